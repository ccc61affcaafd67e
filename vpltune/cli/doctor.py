"""`vpltune doctor`: what of this machine works, and what mends the rest."""

from vpltune.cli.options import JsonOption
from vpltune.cli.report import MACHINE_LACKS, OK, Report

COLOURS = {"ok": "green", "fallback": "yellow", "missing": "red"}


def doctor(json: JsonOption = False) -> Report:
    """Say what of GL, EGL, LLVM, JAX and Mitsuba works here, and the one command that mends the rest."""
    from rich.markup import escape
    from rich.table import Table

    from vpltune.tuner.doctor.machine_findings import examine_machine

    findings = examine_machine()
    lacking = [finding.name for finding in findings if finding.required and finding.state == "missing"]
    status = f"missing: {', '.join(lacking)}" if lacking else "ok"
    table = Table()
    for heading in ("", "state", "found", "used instead"):
        table.add_column(heading, overflow="fold")
    for finding in findings:
        colour = COLOURS[finding.state]
        table.add_row(
            finding.name,
            f"[{colour}]{finding.state}[/]",
            escape(finding.detail),
            escape(finding.fallback),
        )
    mends = dict.fromkeys(finding.mend for finding in findings if finding.mend)
    runtime_alone = any(each.name == "extras" and each.state == "missing" for each in findings)
    able = (
        "This machine can render, export and import; fits need vpltune[tuner]."
        if runtime_alone
        else "This machine can fit and render."
    )
    verdict = f"This machine lacks: {', '.join(lacking)}." if lacking else able
    return Report(
        {"findings": [finding.as_dict() for finding in findings], "status": status},
        (table, *(f"to mend: {escape(mend)}" for mend in mends), escape(verdict)),
        MACHINE_LACKS if lacking else OK,
    )

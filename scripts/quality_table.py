"""Print the table of quality in docs/results.md from the files of `vpltune bench quality` in out/quality."""

import json
from pathlib import Path

FOLDER = Path(__file__).resolve().parents[1] / "out" / "quality"
VARIANTS = ("default", "tuned", "ceiling")


def main() -> None:
    """Print a line for each scene and split: relMSE, energy ratio and FLIP of each variant."""
    print("| scene | split | " + " | ".join(f"{variant}" for variant in VARIANTS) + " | noise floor |")
    print("|---|---|" + "---|" * (len(VARIANTS) + 1))
    for path in sorted(FOLDER.glob("*/metrics.json")):
        metrics = json.loads(path.read_text(encoding="utf-8"))["metrics"]
        for split, label in (("fitted", "fitted"), ("held_out", "held out")):
            cells = [_cell(metrics[split][variant]) for variant in VARIANTS]
            floor = f"{metrics[split]['noise_floor']:.4f}"
            print(f"| {path.parent.name} | {label} | " + " | ".join(cells) + f" | {floor} |")


def _cell(figures: dict[str, float | None]) -> str:
    texts = []
    for key, form in (("relmse", ".3f"), ("energy_ratio", ".2f"), ("flip", ".3f")):
        value = figures[key]
        texts.append("–" if value is None else format(value, form))
    return " / ".join(texts)


if __name__ == "__main__":
    main()

"""Print the table of losses, seconds and frames from the files of `vpltune bench tuning` in out/tuning.

Run `python scripts/tuning_table.py`.
"""

import json

from benchmarks.tuning.tuning import FOLDER, best_found, rows_of, spent_in


def main() -> None:
    """Print a line for each scene and search, then the rows of the benchmark."""
    scenes = [json.loads(path.read_text(encoding="utf-8")) for path in sorted(FOLDER.glob("*.json"))]
    if not scenes:
        raise SystemExit(f"{FOLDER}: nothing measured yet; run `vpltune bench tuning` first")
    print(
        "| scene | search | loss over best | held-out relMSE over ours |"
        " seconds to 1 % | times ours | frames to 1 % | times ours | held out: seconds to 1 % | times ours |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|")
    for scene in scenes:
        best, spent, unseen = best_found(scene), spent_in(scene), spent_in(scene, "held_out")
        ours = spent["ours"]
        for name, search in scene["searches"].items():
            bound = "" if spent[name].arrived else "≥ "
            bound_unseen = "" if unseen[name].arrived else "≥ "
            seconds, frames, later = spent[name].seconds, spent[name].frames, unseen[name].seconds
            print(
                f"| {scene['scene']} | {name} | {search['losses'][-1] / best:.4f} |"
                f" {search['held_out'][-1] / scene['searches']['ours']['held_out'][-1]:.4f} |"
                f" {bound}{seconds:.3g} | {bound}{seconds / ours.seconds:.3g} |"
                f" {bound}{frames} | {bound}{frames / ours.frames:.3g} |"
                f" {bound_unseen}{later:.3g} | {bound_unseen}{later / ours.seconds:.3g} |"
            )
        for name, loss in scene["losses"].items():
            print(f"| {scene['scene']} | {name} | {loss / best:.4g} | | | | | | | |")
    print()
    for row in rows_of(scenes):
        print(f"{row.name}: {row.ratio:.3g} ({row.against})")


if __name__ == "__main__":
    main()

"""Parts of metrics.json that a plain fit does not make, and a way to put them there."""

import json
from pathlib import Path

PLANTED = {
    "uncertainty": {
        "intensity": {"value": 1.0, "low": 0.8, "high": 1.3, "determined": True, "trades_with": []},
        "falloff_footprint": {
            "value": 0.5,
            "low": 0.06,
            "high": 12.0,
            "determined": False,
            "trades_with": ["intensity", "extinction_coefficient"],
        },
    },
    "error_breakdown": {
        "views": "fitted",
        "clamping": 0.01,
        "visibility": 0.2,
        "finite_n": 0.03,
        "missing_bounces": 0.0,
        "filter": 0.005,
        "remainder": -0.02,
    },
    "budget": {
        "frame_size": [640, 480],
        "budget_milliseconds": 4.0,
        "milliseconds": 3.75,
        "predicted_milliseconds": 3.5,
        "relmse": 0.15,
        "vpl_count": 200,
        "choice": {"interleave": 4, "map_size": 16, "rsm_resolution": 512},
        "tries": 2,
    },
    "pareto": [
        {"milliseconds": 1.0, "relmse": 0.5, "parameters": {"vpl_count": 16}, "config": "pareto/0.json"},
        {"milliseconds": 2.0, "relmse": 0.2, "parameters": {"vpl_count": 64}, "config": "pareto/1.json"},
        {
            "milliseconds": 8.0,
            "relmse": 0.1,
            "vpl_count": 512,
            "choice": {"interleave": 4},
            "parameters": {"vpl_count": 512},
            "config": "pareto/2.json",
        },
    ],
}


def change_metrics(folder: Path, **keys: object) -> None:
    """Put `keys` into metrics.json."""
    path = folder / "metrics.json"
    document = json.loads(path.read_text(encoding="utf-8"))
    path.write_text(json.dumps({**document, **keys}), encoding="utf-8")

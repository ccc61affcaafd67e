"""Write configs/default.json and the JSON Schema from the parameter table: `make schema`."""

import json
from pathlib import Path

from vpltune.renderer.config.config_schema import config_schema
from vpltune.renderer.config.tuned_config import TunedConfig, config_text
from vpltune.renderer.files.atomic_file import write_text_whole

CONFIGS = Path(__file__).resolve().parents[1] / "configs"

if __name__ == "__main__":
    write_text_whole(CONFIGS / "default.json", config_text(TunedConfig()))
    schema = json.dumps(config_schema(), indent=2, ensure_ascii=False)
    write_text_whole(CONFIGS / "tuned_config.schema.json", schema + "\n")

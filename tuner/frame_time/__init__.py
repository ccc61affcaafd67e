"""Frame time: a cost model of the passes, and the settings that meet a frame-time budget."""

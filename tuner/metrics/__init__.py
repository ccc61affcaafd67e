"""Error metrics of an image against its reference, and maps that show where the error is."""

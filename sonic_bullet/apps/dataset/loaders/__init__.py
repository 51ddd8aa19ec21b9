"""A data set once more in layouts that loaders read, each split by itself.

    audiofolder   SPLIT/000/000017.wav, SPLIT/metadata.jsonl         Hugging Face `datasets`
    lerobot       SPLIT/data, SPLIT/meta, SPLIT.jsonl                LeRobot, version 3.0
    webdataset    SPLIT-000000.tar of 000017.wav and 000017.json     webdataset
    zarr          SPLIT.zarr.zip, SPLIT.jsonl                        ManiWAV's replay buffer

A layout is written whole beside the samples, in a folder of its format's name, or not at all. Equal data sets give
equal bytes.
"""

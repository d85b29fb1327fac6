"""Defects of files and of manifest.json."""

import numpy as np
from pxr import Sdf

from validator.defects import MIDDLE, defect
from validator.good_cache import HAIR, CacheBuilder


@defect("record")
def wrong_version(cache: CacheBuilder) -> None:
    cache.edit_record(lambda record: record.update(version=2))


@defect("record", "frames")
def no_settings(cache: CacheBuilder) -> None:
    cache.edit_record(lambda record: record.pop("settings"))


@defect("record")
def input_without_checksum(cache: CacheBuilder) -> None:
    cache.edit_record(lambda record: record["inputs"][0].pop("sha256"))


@defect("record")
def frame_without_entry(cache: CacheBuilder) -> None:
    cache.edit_record(lambda record: record["frames"].pop(2))


@defect("record")
def frame_with_two_entries(cache: CacheBuilder) -> None:
    cache.edit_record(lambda record: record["frames"].append(record["frames"][0]))


@defect("figures")
def no_figures(cache: CacheBuilder) -> None:
    cache.edit_record(lambda record: record["frames"][2].update(figures={}))


@defect("figures")
def infinite_figure(cache: CacheBuilder) -> None:
    cache.edit_record(lambda record: record["frames"][2].update(figures={"depth": float("inf")}))


@defect("exempt")
def contact_holds_a_third(cache: CacheBuilder) -> None:
    cache.edit_record(lambda record: record["frames"][2]["figures"].update(exempt_segments=67))


@defect("checksums")
def flipped_bit(cache: CacheBuilder) -> None:
    layer = Sdf.Layer.OpenAsAnonymous(str(cache.frame(MIDDLE)))
    points = np.array(layer.QueryTimeSample(f"{HAIR}.points", float(MIDDLE)))
    data = bytearray(cache.frame(MIDDLE).read_bytes())
    data[data.index(points.tobytes()[:48])] ^= 1
    cache.frame(MIDDLE).write_bytes(bytes(data))


@defect("checksums")
def static_layer_changed(cache: CacheBuilder) -> None:
    with cache.path("hair.usda").open("a") as file:
        file.write("\n")


@defect("checksums")
def layer_without_checksum(cache: CacheBuilder) -> None:
    cache.edit_record(lambda record: record["layers"].pop())


@defect("temporaries")
def temporary_file_left(cache: CacheBuilder) -> None:
    cache.path(".aB3xY.tmp").write_bytes(b"")


@defect("temporaries")
def frame_of_a_longer_bake(cache: CacheBuilder) -> None:
    cache.path("hair.1020.usdc").write_bytes(cache.frame(MIDDLE).read_bytes())

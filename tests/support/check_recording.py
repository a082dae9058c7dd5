"""check_recording.py REC [SCHEMA]: does a closed recording keep the standard and its own word?

The schema (with python3-jsonschema) and what it misses: order of captures and annotations, the hash, the
length of the data, ranges past the end, lines whose surviving range is not theirs.
"""

import bisect
import hashlib
import json
import os
import sys

WIDTH = {"ri16_le": 2, "ri16_be": 2, "rf32_le": 4, "ri8": 1, "ru8": 1}


def faults_of(recording, schema):
    with open(recording + ".sigmf-meta", encoding="utf-8") as file:
        meta = json.load(file)
    if schema:
        import jsonschema
        with open(schema, encoding="utf-8") as file:
            validator = jsonschema.Draft202012Validator(json.load(file))
        for error in validator.iter_errors(meta):
            yield f"schema: {error.message} at {list(error.path)}"
    head, captures, annotations = meta["global"], meta["captures"], meta["annotations"]
    with open(recording + ".sigmf-data", "rb") as file:
        found = hashlib.sha512(file.read()).hexdigest()
    if head.get("core:sha512") != found:
        yield f"core:sha512 is not {found}"
    frame_bytes = WIDTH[head["core:datatype"]] * head.get("core:num_channels", 1)
    frames, odd = divmod(os.path.getsize(recording + ".sigmf-data"), frame_bytes)
    if odd:
        yield f"{odd} bytes after the last frame"
    starts = [capture["core:sample_start"] for capture in captures]
    if starts != sorted(set(starts)) or starts[:1] != [0]:
        yield f"captures start at {starts}"
    if any(start >= frames for start in starts):
        yield f"a capture starts at or past the end, {frames}"
    for before, after in zip(captures, captures[1:]):
        length = after["core:sample_start"] - before["core:sample_start"]
        if after["core:global_index"] < before["core:global_index"] + length:
            yield f"global_index runs backwards at frame {after['core:sample_start']}"
    if [a["core:sample_start"] for a in annotations] != sorted(a["core:sample_start"] for a in annotations):
        yield "annotations are out of order"
    for annotation in annotations:
        yield from line_faults(annotation, starts, captures, frames)


def line_faults(line, starts, captures, frames):
    def stream_index(frame):
        capture = captures[bisect.bisect_right(starts, frame) - 1]
        return capture["core:global_index"] + frame - capture["core:sample_start"]

    start, count = line["core:sample_start"], line["core:sample_count"]
    first, end = line["afm:first_sample"], line["afm:first_sample"] + line["afm:line_samples"]
    if start + count > frames:
        yield f"line at {start} reaches past the end, {frames}"
    elif count:
        if not first <= stream_index(start) <= stream_index(start + count - 1) < end:
            yield f"line at {start}: its frames are not the line's"
        if start > 0 and stream_index(start - 1) >= first:
            yield f"line at {start}: the frame before is the line's as well"
        if start + count < frames and stream_index(start + count) < end:
            yield f"line at {start}: the frame after is the line's as well"


def main():
    faults = list(faults_of(sys.argv[1], sys.argv[2] if len(sys.argv) > 2 else None))
    for fault in faults:
        print(fault, file=sys.stderr)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())

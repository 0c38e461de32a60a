#!/usr/bin/python3
"""Reads numbers out of bags for `faultline import`, through rosbag's dynamic message types.

Standard input: one line of JSON {"files": [BAG...], "time": "auto" | "header" | "receipt", "fields": ["/topic/field"...]}.
Standard output: records, see message_fields.py. The note before the end is JSON {"clock": {TOPIC: source}, "unused":
[TOPIC...]}. Messages come in the order of the bags' receive times. Exit: 0, 2 for what was refused in an error record.
"""

import json
import os
import sys

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
sys.dont_write_bytecode = True

from message_fields import (  # noqa: E402
    END, ERROR, NOTE, RECORD, Absent, Clock, Field, FieldError, one_line, text_record, topic_of, unknown_topic,
)

BLOCK = 1 << 16  # bytes written at once


def open_bags(files):
    try:
        import rosbag
    except ImportError as problem:
        raise FieldError(f"Python finds no rosbag ({one_line(problem)}); install python3-rosbag, source ROS's setup.bash")
    bags = []
    for file in files:
        try:
            bag = rosbag.Bag(file)
            if bag.get_message_count() == 0:
                raise FieldError(f"{file}: the bag holds no message")
            bags.append((bag.get_start_time(), file, bag))
        except FieldError:
            raise
        except rosbag.ROSBagUnindexedException:
            raise FieldError(f"{file}: the bag has no index, it was cut off; `rosbag reindex {file}` mends it")
        except OSError as problem:
            raise FieldError(f"{file}: the file cannot be read ({problem.strerror or one_line(problem)})")
        except Exception as problem:
            raise FieldError(f"{file}: this is no bag that can be read ({one_line(problem)})")
    return sorted(bags, key=lambda bag: bag[0])


def read(request, write):
    bags = open_bags(request["files"])
    where = bags[0][1] if len(bags) == 1 else "the bags"
    topics = {connection.topic for _, _, bag in bags for connection in bag._get_connections()}
    fields = {}
    for number, path in enumerate(request["fields"]):
        topic = topic_of(path, topics)
        if topic is None:
            raise FieldError(unknown_topic(path, topics, where))
        fields.setdefault(topic, []).append((number, Field(path, topic)))
    clocks = {topic: Clock(topic, request["time"]) for topic in fields}
    missing = {number: f"{path}: no message of it is in {where}" for number, path in enumerate(request["fields"])}
    block = bytearray()
    for _, file, bag in bags:
        try:
            for topic, message, received in bag.read_messages(topics=list(fields)):
                stamp = clocks[topic].time(message, received.to_nsec())
                for number, field in fields[topic]:
                    try:
                        block += RECORD.pack(number, stamp, field.read(message))
                        missing.pop(number, None)
                    except Absent as problem:
                        if number in missing:
                            missing[number] = str(problem)
                if len(block) >= BLOCK:
                    write(block)
                    block = bytearray()
        except (FieldError, BrokenPipeError):
            raise
        except Exception as problem:
            raise FieldError(f"{file}: a message cannot be read ({one_line(problem)})")
        finally:
            bag.close()
    if missing:
        raise FieldError(missing[min(missing)])
    write(block)
    clock = {topic: clocks[topic].source for topic in fields}
    write(text_record(NOTE, json.dumps({"clock": clock, "unused": sorted(topics - set(fields))})))
    write(text_record(END, ""))


def main():
    out = sys.stdout.buffer
    try:
        read(json.loads(sys.stdin.readline()), out.write)
        out.flush()
        return 0
    except BrokenPipeError:
        os._exit(2)  # who asked is gone
    except FieldError as problem:
        out.write(text_record(ERROR, str(problem)))
    except Exception as problem:
        out.write(text_record(ERROR, f"reading the bag failed ({type(problem).__name__}: {one_line(problem)})"))
    out.flush()
    return 2


if __name__ == "__main__":
    sys.exit(main())

#!/usr/bin/python3
"""Reads numbers out of live topics for rig_driver_node, whatever the messages' types are.

Standard input: one line of JSON {"node": NAME, "time": "auto" | "header" | "receipt", "fields": ["/topic/field"...]};
the script ends when standard input does. Standard output: records, see message_fields.py; a note says what is waited
for or left out, an empty one that nothing is. The first publisher that gives a field is the one that counts, as long
as it is connected; joints, for example, may come from several on one topic. Types come from the publishers themselves,
so their packages need not be installed.
Callbacks only put bytes into a queue that a thread writes out.
"""

import json
import os
import queue
import sys
import threading

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
sys.dont_write_bytecode = True

from message_fields import (  # noqa: E402
    ERROR, NOTE, RECORD, Absent, Clock, Field, FieldError, listed, one_line, text_record, topic_of, unknown_topic,
)

LOOK = 0.2  # s of wall time between looks at what is published
BUFFER = 1 << 22  # bytes of a socket read at once: seconds of small messages
waiting = queue.SimpleQueue()  # of bytes; None: write what is there and end
making_a_type = threading.Lock()  # genpy's generator keeps what it has seen of a message in globals of its own


class TopicReader:
    def __init__(self, topic, wanted_clock):
        self.topic, self.clock = topic, Clock(topic, wanted_clock)
        self.fields, self.types, self.absent = [], {}, {}
        self.subscriber = None
        self.sources, self.others = {}, {}  # of each field: the publisher that counts, one that does not
        self.delivered = False
        self.lock = threading.Lock()  # rospy calls back from a thread for each publisher

    def type_of(self, header):
        key = header["type"], header["md5sum"]
        if key not in self.types:
            import genpy.dynamic

            with making_a_type:
                made = genpy.dynamic.generate_dynamic(header["type"], header["message_definition"])
            self.types[key] = made[header["type"]]
        return self.types[key]

    def connected(self):
        connections = self.subscriber.impl.connections if self.subscriber else ()
        return {connection.callerid_pub for connection in connections or ()}

    def counts(self, number, publisher):
        source = self.sources.setdefault(number, publisher)
        if source != publisher and source in self.connected():
            self.others[number] = publisher
            return False
        self.sources[number] = publisher
        return True

    def left_out(self):
        """What to say of those that send a field too, while they are there; empty: there are none."""
        connected = self.connected()
        for number, field in self.fields:
            other, source = self.others.get(number), self.sources.get(number)
            if other in connected and other != source:
                return f"{other} publishes {field.path} too and is left out, {source} counts; end one of the two"
        return ""

    def take(self, raw):
        import rospy

        received = rospy.get_rostime().to_nsec()
        try:
            with self.lock:
                message = self.type_of(raw._connection_header)().deserialize(raw._buff)
                stamp = self.clock.time(message, received)
                if stamp == 0:  # simulated time has not begun
                    return
                block = bytearray()
                for number, field in self.fields:
                    try:
                        value = field.read(message)
                        self.absent.pop(number, None)
                        if self.counts(number, raw._connection_header["callerid"]):
                            block += RECORD.pack(number, stamp, value)
                    except Absent as problem:
                        self.absent[number] = str(problem)
                waiting.put(bytes(block))
                self.delivered = True
        except FieldError as problem:
            # One message without a stamp does not end what ran well.
            waiting.put(text_record(NOTE if self.delivered else ERROR, str(problem)))
        except Exception as problem:
            waiting.put(text_record(ERROR, f"{self.topic}: a message cannot be read ({one_line(problem)})"))


def watch(request):
    """Subscribes to topics as they appear, and says what is not there yet."""
    import rospy

    rospy.init_node(request["node"], anonymous=True, disable_signals=True)
    left = dict(enumerate(request["fields"]))
    readers, told = {}, None
    while not rospy.is_shutdown():
        topics = {topic for topic, _ in rospy.get_published_topics()}
        for number, path in list(left.items()):
            topic = topic_of(path, topics)
            if topic is None:
                continue
            readers.setdefault(topic, TopicReader(topic, request["time"])).fields.append((number, Field(path, topic)))
            del left[number]
        for reader in readers.values():
            if reader.subscriber is None:
                reader.subscriber = rospy.Subscriber(
                    reader.topic, rospy.AnyMsg, reader.take, queue_size=None, buff_size=BUFFER, tcp_nodelay=True
                )
        absent = [text for reader in readers.values() for text in list(reader.absent.values())]
        left_out = [text for text in (reader.left_out() for reader in readers.values()) if text]
        note = "; ".join(absent[:1] + left_out[:1])
        if left:
            note = f"nobody publishes {listed(left.values())}"
            close = [unknown_topic(path, topics, "the graph") for path in left.values()]
            note += "".join(text[text.index("; did you mean") :] for text in close if "; did you mean" in text)[:200]
        if note != told:
            waiting.put(text_record(NOTE, note))
            told = note
        rospy.rostime.wallsleep(LOOK)


def write_out(out):
    while True:
        data = waiting.get()
        if data is not None:
            out.write(data)
        if waiting.empty():
            out.flush()
        if data is None:
            os._exit(0)


def end_with_input():
    sys.stdin.read()
    os._exit(0)


def main():
    request = json.loads(sys.stdin.readline())
    threading.Thread(target=write_out, args=(sys.stdout.buffer,), daemon=True).start()
    threading.Thread(target=end_with_input, daemon=True).start()
    try:
        watch(request)
        waiting.put(text_record(ERROR, "ROS is shutting down"))
    except FieldError as problem:
        waiting.put(text_record(ERROR, str(problem)))
    except ImportError as problem:
        waiting.put(text_record(ERROR, f"Python finds no rospy ({one_line(problem)}); source ROS's setup.bash"))
    except Exception as problem:
        waiting.put(text_record(ERROR, f"reading topics failed ({type(problem).__name__}: {one_line(problem)})"))
    waiting.put(None)
    threading.Event().wait()


if __name__ == "__main__":
    main()

"""Recordings whose start is missing, as of a recorder that connected late. In the built environment."""


def cut_start(source, target, missing, again=None):
    """Writes `source` without its first `missing` samples; with `again` once more, 100 s later, without that many."""
    import genpy
    import rosbag

    with rosbag.Bag(str(target), "w") as out:
        for later, left_out in [(0, missing)] + ([(100, again)] if again else []):
            for topic, message, received in rosbag.Bag(str(source)).read_messages():
                if topic.endswith("/sample") and message.sequence < left_out:
                    continue
                message.header.stamp += genpy.Duration(later)
                out.write(topic, message, received + genpy.Duration(later))

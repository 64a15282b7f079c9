"""Cut the decisions out of a recording: `python -m tests.replay.cut_recording FROM TO SECONDS`.

What the deciders read, said and remembered stays, byte for byte; pictures, masks, sensors and truth go. The recordings
beside this file were made so from drives of `paani trial --one CASE --record FILE`.
"""

from __future__ import annotations

import sys
from pathlib import Path

from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from paani.decider import deciders
from paani_tools.replay.ledger import Ledger


def cut(source: Path, target: Path, seconds: float) -> int:
    """Write the first seconds of a recording. Returns how many messages they hold."""
    topics = sorted({topic for decider in deciders().values() for topic in Ledger(decider).topics})
    count = 0
    with source.open("rb") as read, target.open("xb") as written:
        reader = make_reader(read)
        writer = Writer(written, chunk_size=1 << 20, compression=CompressionType.ZSTD)
        writer.start(profile=reader.get_header().profile, library=reader.get_header().library)
        for metadata in reader.iter_metadata():
            writer.add_metadata(metadata.name, metadata.metadata)
        for attachment in reader.iter_attachments():
            writer.add_attachment(
                attachment.create_time, attachment.log_time, attachment.name, attachment.media_type, attachment.data
            )
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        end_ns = summary.statistics.message_start_time + round(seconds * 1e9)
        channels: dict[int, int] = {}
        for schema, channel, message in reader.iter_messages(topics=topics, ending_before=end_ns):
            if channel.id not in channels:
                kind = writer.register_schema(schema.name, schema.encoding, schema.data) if schema is not None else 0
                channels[channel.id] = writer.register_channel(
                    channel.topic, channel.message_encoding, kind, channel.metadata
                )
            writer.add_message(
                channels[channel.id], message.log_time, message.data, message.publish_time, message.sequence
            )
            count += 1
        writer.finish()
    return count


if __name__ == "__main__":
    sys.stdout.write(f"{cut(Path(sys.argv[1]), Path(sys.argv[2]), float(sys.argv[3]))} messages\n")

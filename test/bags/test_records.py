# SPDX-License-Identifier: Apache-2.0
"""Where the records of a chunk begin: the compiled search equals the one in Python."""

import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from zstandard import ZstdCompressor, ZstdDecompressor

from intent_recognition.bags.mcap import records
from intent_recognition.bags.mcap.chunk import McapBlock, _decompress, read_messages

HEAD, LEAST = records.RECORD_HEADER.size, records.LEAST_MESSAGE
SEARCHES = [records._positions, *filter(None, [records._compiled])]
RECORD = st.builds(
    lambda opcode, content, said: struct.pack("<BQ", opcode, len(content) + said) + content,
    st.sampled_from([records.MESSAGE, 3, 4]),
    st.binary(max_size=40),
    st.sampled_from([0, 0, 0, 0, 1, 2**63]),
)


def found_by(search, data):
    out = np.empty(len(data) // HEAD, np.int64)
    n, end = search(data, out, HEAD, records.MESSAGE, LEAST)
    return out[:n].tolist(), end


@pytest.mark.skipif(records._compiled is None, reason="no compiler")
@given(st.lists(RECORD, max_size=20).map(b"".join) | st.binary(max_size=200))
def test_compiled_and_python_searches_find_the_same(data):
    assert found_by(records._compiled, data) == found_by(records._positions, data)


@pytest.mark.parametrize("search", SEARCHES)
def test_records_begin_where_the_ones_before_end(search, monkeypatch):
    monkeypatch.setattr(records, "_compiled", search)
    sizes = [LEAST, LEAST + 5, 700, LEAST]
    data = b"".join(struct.pack("<BQ", records.MESSAGE, size) + bytes(size) for size in sizes)
    begins = np.cumsum([0, *(HEAD + size for size in sizes)])
    assert records.record_positions(data, is_cut=False).tolist() == begins[:-1].tolist()
    assert records.record_positions(data[:-1], is_cut=True).tolist() == begins[:-2].tolist()
    with pytest.raises(ValueError, match="inside of a record"):
        records.record_positions(data[:-1], is_cut=False)
    with pytest.raises(ValueError, match="a message of less than"):
        records.record_positions(struct.pack("<BQ", records.MESSAGE, 3) + bytes(3), is_cut=False)


def test_blocks_that_are_read_together_end_with_their_records():
    whole, long = (
        struct.pack("<BQ", records.MESSAGE, size) + bytes(LEAST)
        for size in (LEAST, 2 * LEAST + HEAD)
    )
    blocks = [McapBlock(at, LEAST, 0, 0, len(whole), is_chunk=False) for at in (0, len(whole))]
    assert read_messages(whole * 2, *blocks).starts.size == 2
    with pytest.raises(ValueError, match="inside of a record"):
        read_messages(long + whole, *blocks)


@pytest.mark.parametrize("share", [0.3, 0.6, 0.9])
def test_all_of_a_chunk_that_is_cut_off_is_read(share, rng):
    content = rng.bytes(200_000)  # such as images: blocks of zstd are larger than one read
    packed = ZstdCompressor().compress(content)[: int(share * len(content))]
    read = _decompress("zstd", packed, len(content), ZstdDecompressor(), is_cut=True)
    assert read == ZstdDecompressor().decompressobj().decompress(packed)
    assert len(read) > len(packed) - 100

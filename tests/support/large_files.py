"""Small files that ask for much memory: a picture, and a model with a constant."""

from __future__ import annotations

import struct
import zlib

import onnx
from onnx import TensorProto, helper


def large_png(side: int) -> bytes:
    """A black picture of side x side pixels, a bit each."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    packer, row = zlib.compressobj(9), bytes(1 + (side + 7) // 8)
    data = b"".join(packer.compress(row) for _ in range(side)) + packer.flush()
    header = struct.pack(">IIBBBBB", side, side, 1, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", data) + chunk(b"IEND", b"")


def model(floats: int | None = None) -> bytes:
    """A model that returns its input, plus the sum of a constant of so many floats."""
    nodes, initializers = [helper.make_node("Identity", ["images"], ["output0"])], []
    if floats is not None:
        one = helper.make_tensor("one", TensorProto.FLOAT, [1], [1.0])
        initializers = [helper.make_tensor("shape", TensorProto.INT64, [1], [floats])]
        nodes = [
            helper.make_node("ConstantOfShape", ["shape"], ["ones"], value=one),
            helper.make_node("ReduceSum", ["ones"], ["sum"], keepdims=0),
            helper.make_node("Add", ["images", "sum"], ["output0"]),
        ]
    ports = [helper.make_tensor_value_info("images", TensorProto.FLOAT, [1, 3, 64, 64])]
    out = [helper.make_tensor_value_info("output0", TensorProto.FLOAT, None)]
    graph = helper.make_graph(nodes, "graph", ports, out, initializers)
    made: bytes = onnx.helper.make_model(
        graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8
    ).SerializeToString()
    return made

"""An ONNX graph written node by node."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import onnx
from numpy.typing import ArrayLike, DTypeLike
from onnx import helper, numpy_helper

from cylinder_friction.estimators.onnx_files import IR_VERSION, OPSETS

ML_OPERATORS = {"TreeEnsembleRegressor": "ai.onnx.ml"}


class Graph:
    """Collects nodes and constants; tensors go by name, and equal constants are stored once.

    Args:
        prefix: Of the constants' names: the body of a loop must not use those of the graph around it.
    """

    def __init__(self, prefix: str = "") -> None:
        self._prefix = prefix
        self._nodes: list[onnx.NodeProto] = []
        self._constants: dict[tuple[str, tuple[int, ...], bytes], onnx.TensorProto] = {}
        self._inputs: list[onnx.ValueInfoProto] = []
        self._outputs: list[onnx.ValueInfoProto] = []

    def add(self, operator: str, *inputs: str, to: str, **attributes: Any) -> str:
        """Add a node with one output, named ``to``, and return that name."""
        self.add_many(operator, *inputs, to=[to], **attributes)
        return to

    def add_many(self, operator: str, *inputs: str, to: Sequence[str], **attributes: Any) -> None:
        """Add a node with several outputs; one that is not used is named ``""``."""
        domain = ML_OPERATORS.get(operator, "")
        name = next(output for output in to if output)
        self._nodes.append(helper.make_node(operator, inputs, to, name=name, domain=domain, **attributes))

    def constant(self, values: ArrayLike, dtype: DTypeLike = np.float64) -> str:
        """Return the name of a constant tensor."""
        array = np.array(values, dtype=dtype, order="C")
        key = (array.dtype.str, array.shape, array.tobytes())
        if key not in self._constants:
            self._constants[key] = numpy_helper.from_array(array, f"{self._prefix}constant_{len(self._constants)}")
        return str(self._constants[key].name)

    def indices(self, *values: int) -> str:
        """Return the name of a constant list of integers: axes, positions or lengths."""
        return self.constant(values, np.int64)

    def split(self, source: str, parts: Mapping[str, int], axis: int = 1) -> None:
        """Cut a tensor along ``axis`` into named parts of the given lengths."""
        self.add_many("Split", source, self.indices(*parts.values()), to=list(parts), axis=axis)

    def cast(self, source: str, to: str, kind: int) -> str:
        """Add a change of type."""
        self._nodes.append(helper.make_node("Cast", [source], [to], name=to, to=kind))
        return to

    def takes(self, name: str, kind: int, shape: Sequence[int | str], meaning: str) -> None:
        """Declare an input of the graph."""
        self._inputs.append(helper.make_tensor_value_info(name, kind, shape, meaning))

    def gives(self, name: str, kind: int, shape: Sequence[int | str], meaning: str) -> None:
        """Declare an output of the graph."""
        self._outputs.append(helper.make_tensor_value_info(name, kind, shape, meaning))

    def body(self, name: str) -> onnx.GraphProto:
        """Return the graph as the body of a loop in another one."""
        constants = list(self._constants.values())
        return helper.make_graph(self._nodes, name, self._inputs, self._outputs, constants)

    def model(self, name: str, meaning: str, metadata: Mapping[str, str]) -> onnx.ModelProto:
        """Return the checked model; equal graphs are equal bytes."""
        graph = helper.make_graph(
            self._nodes, name, self._inputs, self._outputs, list(self._constants.values()), doc_string=meaning
        )
        opsets = [helper.make_opsetid(*each) for each in OPSETS.items()]
        model = helper.make_model(
            graph, opset_imports=opsets, ir_version=IR_VERSION, producer_name="cylinder-friction", doc_string=meaning
        )
        helper.set_model_props(model, dict(sorted(metadata.items())))
        onnx.checker.check_model(model, full_check=True)
        return model

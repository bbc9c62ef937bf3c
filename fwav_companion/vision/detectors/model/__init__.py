"""The detector of a user's own ONNX model.

``families`` is the table of the families and their presets, ``recognition`` finds the layout of a file in it,
``decoders`` turn outputs into boxes, ``model_file`` and ``model_input`` are the file and what is fed to it,
``tiles`` cuts large pictures, ``plausibility`` judges the first outputs, ``box_sigma`` is the accuracy of a box.
"""

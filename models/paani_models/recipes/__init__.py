"""From pictures to a shipped network: which pictures train which network how, warm starts, export to ONNX."""

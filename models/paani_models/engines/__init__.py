"""Running exported networks: onnxruntime and ncnn, their parity, speed and cost."""

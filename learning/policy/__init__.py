"""Policies: the training environment, PPO, export to ONNX and FMU, evaluation."""

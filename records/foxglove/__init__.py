"""The machine and what stands around it in Foxglove's messages, for recordings and live."""

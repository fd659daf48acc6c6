"""The parts of `maniport.transfer.LengthField`: map, kernels, inverse, fit, report."""

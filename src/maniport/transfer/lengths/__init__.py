"""The parts of `maniport.transfer.LengthsField`: map, kernels, inverse, fit, report."""

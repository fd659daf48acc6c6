"""The parts of `maniport.transfer.LengthsField`: its map, its inverse, its fit, whom it asks, what it reports."""

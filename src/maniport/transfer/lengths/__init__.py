"""The parts of `maniport.transfer.LengthsField`: its map, its fit, whom it asks for the nearest, what it reports."""

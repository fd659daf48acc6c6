"""Laws of public functions, over sizes, conditions, units, kinds of numbers and orders in memory."""

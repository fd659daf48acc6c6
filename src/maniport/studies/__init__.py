"""The experiments of Reithmeir, Figueredo and Haddadin (IROS 2022, arXiv 2208.07588), run again."""

"""Other ways of doing the same work, written as well as the other libraries allow."""

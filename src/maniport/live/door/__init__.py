"""The door of what is live: frames come in as lines of JSON, joint positions go out, by pipe or by UDP."""

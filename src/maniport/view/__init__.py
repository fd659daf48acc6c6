"""The live view: a page in the browser where a person's arm is moved and a robot follows.

What happens is in `maniport.view.state` and needs no browser; `scene` and `panel` show it, `server` runs the loop.
"""

"""The live view: a page in the browser where a person's arm is moved and a robot follows.

`maniport.viewer.state` computes it without a page; `scene` draws it, `server` has the controls and the loop.
"""

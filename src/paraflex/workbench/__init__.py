"""The editor of mechanisms: a text, the edits of a person, and pictures, poses and numbers for its page."""

"""The live app: a local server, the page that it serves, and the missions that it starts.

The server holds nothing that a boat needs: a mission is a process of its own (`boat`), which goes
on where server and browser end, and is found again through a file beside its survey.
"""

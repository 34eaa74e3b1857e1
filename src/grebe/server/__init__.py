"""The live app: a local server, the page that it serves, and the missions that it starts.

The server holds nothing that a boat needs. A mission is a process of its own (`boat`): it continues
when server and browser end, and a new server finds it through a file beside its survey.
"""

"""The connection between the processes of the tuning page: the channel of the loop, requests, message socket, address.

It may import `stream`, files, errors, pydantic and pyzmq. It must not import the session or the pages, which use this
package. Nothing here makes the loop wait.
"""

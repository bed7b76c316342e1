"""The connections between the processes of the tuning page: channel, requests, message socket, address of the page.

It may import `stream`, files, errors, pydantic and pyzmq. It must not import the session or the pages, which use this
package. Nothing here makes the loop wait.
"""

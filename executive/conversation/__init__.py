"""A conversation with a robot that works: requests, corrections, questions and answers, remarks about the run.

From Python, beside a run:

    conversation = Conversation(speech, control)
    run([entry], control=control, visitors=[conversation], ...)           # in one thread
    reply = conversation.hear("no, the hammer", now_s=12.0)               # from another
    print(reply.text)
"""

from executive.conversation.dialogue import Conversation
from executive.conversation.replies import Reply, ReplyKind, Speech

__all__ = ["Conversation", "Reply", "ReplyKind", "Speech"]

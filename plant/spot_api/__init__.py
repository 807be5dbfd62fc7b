"""Boston Dynamics' API of Spot. Needs the extra `spot`; nothing else imports the SDK."""

"""Contacts, stances, contact transitions and sequences; transition models, projection and reach."""

"""Sensitivities: derivatives of what runs are judged by, by any numbers of the mechanism's file."""

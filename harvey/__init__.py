"""The only wiring place, and the command line."""

from harvey.arithmetic import settle

settle()

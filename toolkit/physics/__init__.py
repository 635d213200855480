"""The laws that planner, controller and checks share, each written once."""

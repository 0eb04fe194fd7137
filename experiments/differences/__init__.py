"""What happens when the truth differs from what the robot believes?"""

"""What a simulated run shows: the channels of a recording, how well both agree, the stride of what walks."""

"""Public logs of real machines: what metaid hands over of them, measured from outside, beside what others say."""

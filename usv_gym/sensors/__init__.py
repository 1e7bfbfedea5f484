"""The picture: what navigation, AIS, radar, LiDAR and the Target Detection Module make of the world."""

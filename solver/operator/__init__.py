"""What waves are governed by: materials, and the discrete wave operator of an atlas."""

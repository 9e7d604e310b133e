# Sourced by guest.sh: the whole program on the simulated USB camera that shows the synthetic desk. It initialises by itself, and
# what it tracked is measured against the poses that the film was made with, at the times at which its frames were shown.
rate=5 frames=75
plug_in 320 240 $rate /vm/film.grey
sed 's/^Camera.width:.*/Camera.width: 640/' /vm/calibration.yaml >/tmp/calibration.yaml
check "a calibration for another size" bash -c '/vm/parallax live --headless --camera v4l2: --size 320x240 --calibration \
  /tmp/calibration.yaml --frames-limit 9 2>&1 | tee /dev/stderr |
  grep "/tmp/calibration.yaml: the calibration is for images of 640x240, found images of 320x240"'
check "the program on the USB camera" timeout 110 /vm/parallax live --headless --camera v4l2: --size 320x240 \
  --calibration /vm/calibration.yaml --frames-limit $((frames - 5)) --trajectory /vm/trajectory.txt --report /vm/report.json
pull_out
# The true poses with the times instead of the frame numbers.
awk 'NR == FNR { time[$1] = $2; next } $1 in time { $1 = time[$1]; print }' /vm/film.grey.times /vm/truth.txt >/vm/truth_timed.txt
# 30 poses at least, within 5 mm of the truth (rms) on a path of decimetres.
check "its trajectory" bash -c '/vm/parallax eval /vm/trajectory.txt /vm/truth_timed.txt --max-time-difference 0.05 |
  tee /dev/stderr | awk "/ATE position/ { good = \$4 < 0.005 && \$NF >= 30 } END { exit !good }"'

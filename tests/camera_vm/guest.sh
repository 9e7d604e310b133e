#!/bin/bash
# Runs in the virtual machine that scripts/camera-test boots: capture checks against real kernel drivers. All output goes to
# /vm/log, the number of failed checks to /vm/result. /vm holds the programs and the film.
export PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/tmp LANG=C.UTF-8
cd /vm
exec >/vm/log 2>&1 </dev/null
failed=0 passed=0
kernel=$(uname -r)
seconds() { cut -d' ' -f1 /proc/uptime; }
load() { modprobe -d /kernel -S "$kernel" "$@"; }
capture=/vm/camera_capture_check

# check NAME COMMAND...: runs it, for two minutes at most (a loaded machine may take half of that to load a program).
check() {
  local name=$1
  shift
  echo "-- $(seconds) s: $name"
  if timeout 120 "$@"; then
    passed=$((passed + 1))
  else
    echo "FAILED ($?): $name"
    failed=$((failed + 1))
  fi
}

# A program in the background is found by its number in $camera.
wait_for_device() {
  for _ in $(seq 100); do
    [ -e "$1" ] && break
    sleep 0.1
  done
  udevadm settle -t 10
}
plug_in() {
  /vm/uvc_camera "$@" &
  camera=$!
  wait_for_device /dev/video0
}
pull_out() {
  kill "$camera" 2>/dev/null
  wait "$camera" 2>/dev/null
  for _ in $(seq 100); do
    [ -e /dev/video0 ] || break
    sleep 0.1
  done
}

# check_replug NAME ARGUMENTS...: a camera that goes when it has sent 8 frames and is back 2 s later. When it fails it is told what
# libcamera and the kernel had to say.
check_replug() {
  local failures=$failed
  plug_in 320 240 10 - 8 2000
  rm -f /tmp/libcamera
  LIBCAMERA_LOG_FILE=/tmp/libcamera LIBCAMERA_LOG_LEVELS='*:DEBUG' check "$1" $capture replug "${@:2}"
  if [ "$failed" != "$failures" ]; then
    [ ! -e /tmp/libcamera ] || tail -n 40 /tmp/libcamera
    dmesg | tail -n 10
  fi
  pull_out
}

echo "-- $(seconds) s: kernel $kernel"
/lib/systemd/systemd-udevd --daemon

check "no camera is found" bash -c '/vm/parallax cameras | grep "no camera found"'
check "no camera, no such device, no video device" $capture refused v4l2: "no camera found" \
  v4l2:/dev/video7 "no such device" v4l2:/dev/null "is not a video device" libcamera: "no camera found"

# The virtual video test driver.
load vivid n_devs=2 node_types=0x1,0x1 num_inputs=1,1 input_types=0x00,0x00 num_outputs=0,0 vid_cap_nr=5,6 multiplanar=1,2
wait_for_device /dev/video6
check "vivid, all formats" $capture frames v4l2:/dev/video5 320 180 15 YUYV,UYVY,GREY,NV12,RGB3,BGR3 bars 4
check "vivid, busy" $capture busy v4l2:/dev/video5 320 180 15 YUYV
check "vivid, planes one by one" $capture refused v4l2:/dev/video6 "which only libcamera handles"
chmod 660 /dev/video5
# `nobody` is not in the group of video devices.
check "vivid, permission denied" setpriv --reuid=65534 --regid=65534 --clear-groups \
  $capture refused v4l2:/dev/video5 "permission denied: add yourself"
check "vivid is listed" bash -c '/vm/parallax cameras v4l2:/dev/video5 | grep "YUYV  320x180 at"'
check "vivid disconnects" $capture gone v4l2:/dev/video5 320 180 15 YUYV
rmmod vivid

# A USB camera behind uvcvideo.
load uvcvideo
load vhci_hcd
plug_in 320 240 10
check "USB camera, V4L2" $capture frames v4l2: 320 240 10 YUYV,MJPG test 5
check "USB camera, libcamera" $capture frames libcamera: 320 240 10 YUYV,MJPG test 5
check "USB camera, controls are held and put back" $capture profile v4l2: 320 240 10
check "USB camera is listed as JSON" bash -c '/vm/parallax cameras --json | grep "\"exposure_time_absolute\""'
pull_out
for source in v4l2: libcamera:; do
  for format in YUYV MJPG; do
    check_replug "USB camera pulled out and plugged in again, $source $format" $source 320 240 10 $format test 5
  done
done

if [ -e /vm/film.grey ]; then
  . /vm/program.sh
fi

echo "-- $(seconds) s: $passed passed, $failed failed"
echo "$failed" >/vm/result
sync
echo o >/proc/sysrq-trigger
# The machine goes off by itself.
sleep 60

// A live camera that survives unplugging, whatever it is reached through: connects, delivers the newest frame, notices
// that the camera has gone, looks for it again and goes on, and says at every moment how things stand.
//
// Looking again: twice a second. The camera that was lost is taken, or another one that the back end names; it must
// give pictures of the same size, since the map and the calibration hold for that size.
//
// Frames: numbered by what the camera sent, so that a skipped or damaged one leaves a hole. Times grow strictly: a time
// that is not of this clock, or does not grow, is replaced by the time at which the frame came. A damaged frame is
// dropped, counted, and told of at most once a second. A camera from which nothing, or nothing but damaged frames, has
// come for ten seconds is connected anew.
#pragma once

#include <atomic>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "camera/camera_connection.h"
#include "camera/live_camera.h"
#include "camera/live_frame_rate.h"
#include "core/mutex.h"

namespace parallax {

// See LiveCamera for what may be called from where; next() and take_warnings() are for one thread, which works for it:
// there is no thread of its own.
class ReconnectingCamera final : public LiveCamera {
 public:
  // Connects to the first candidate that can be used. Throws InputError: what is wrong with the first that cannot.
  ReconnectingCamera(std::unique_ptr<CameraBackend> backend, const LiveCameraOptions& options);
  ~ReconnectingCamera() override;

  std::optional<Frame> next() override;
  std::vector<SourceWarning> take_warnings() override { return std::exchange(warnings_, {}); }
  CameraStatus status() const override;
  void stop() override;
  std::vector<CameraControl> controls() override;
  void set_control(const std::string& name, std::int64_t value) override;

  int width() const override { return options_.width; }
  int height() const override { return options_.height; }
  std::string identity() const override;
  std::string description() const override;
  double frames_per_second() const override;

 private:
  using Connection = std::shared_ptr<CameraConnection>;

  Connection current() const;
  Connection connect_first();
  void begin(Connection connection);
  void disconnect(const std::string& text);
  void leave(const std::string& trouble);
  std::string only_damaged() const;
  void look_again();
  // True: a picture has arrived that is to be decoded.
  bool take_stock(const CameraArrival& arrival);
  std::optional<Frame> decode(const CameraArrival& arrival);
  Timestamp frame_time(Timestamp by_driver);
  void delivered(CameraConnection& connection, const Frame& frame);
  void tell_damaged(int frame, int count, const std::string& problem);
  void warn(int frame, const std::string& text);
  void look_at_the_second(const CameraConnection& connection);

  const std::unique_ptr<CameraBackend> backend_;
  LiveCameraOptions options_;  // width and height: what the first camera gave; constant once constructed
  std::atomic<bool> stopped_{false};

  mutable Mutex mutex_;
  Connection connection_ PARALLAX_GUARDED_BY(mutex_);
  CameraStatus status_ PARALLAX_GUARDED_BY(mutex_);
  std::string identity_ PARALLAX_GUARDED_BY(mutex_), description_ PARALLAX_GUARDED_BY(mutex_);
  std::vector<std::pair<std::string, std::int64_t>> wanted_controls_ PARALLAX_GUARDED_BY(mutex_);

  // Of the thread that reads.
  std::vector<SourceWarning> warnings_;
  std::string trouble_;       // why a camera that is there was left; told until a good frame comes
  std::string last_problem_;  // of looking again
  std::string last_damage_;
  int next_index_ = 0;
  Timestamp last_time_{0};        // of a frame
  Timestamp heard_{0}, good_{0};  // when anything, and a good frame, came last
  FrameRateMeter meter_;
  std::uint64_t between_ = 0;  // frames since the one that the meter saw last
  struct Second {
    Timestamp begin{0};
    int frames = 0, damaged = 0;
  } second_;
  struct Untold {
    Timestamp told{0};  // when damaged frames were told of last
    int count = 0, frame = -1;
    std::string problem;
  } untold_;
};

}  // namespace parallax

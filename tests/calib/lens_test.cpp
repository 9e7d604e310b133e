#include "calib/lens.h"

#include <gtest/gtest.h>

#include "calib/lens_conversion.h"
#include "core/error.h"
#include "tests/calib/rendered_board.h"

namespace parallax {
namespace {

using calib_test::lenses;

TEST(Lens, ParametersMakeTheSameLensAgain) {
  for (const auto& [model, camera] : lenses()) {
    EXPECT_EQ(lens_model(camera), model);
    EXPECT_EQ(lens_parameters(camera).size(), lens_parameter_count(model));
    EXPECT_EQ(lens_parameter_names(model).size(), static_cast<std::size_t>(lens_parameter_count(model)));
    const auto again = make_lens(model, 640, 480, lens_parameters(camera));
    ASSERT_TRUE(again) << to_string(model);
    EXPECT_EQ(*again, camera);
    EXPECT_EQ(lens_model(std::string(to_string(model))), model);
  }
  EXPECT_EQ(lens_model(std::string("radtan")), LensModel::radtan5);
  EXPECT_THROW((void)lens_model(std::string("fisheye")), InputError);
}

TEST(Lens, JacobiansAreTheDifferences) {
  for (const auto& [model, camera] : lenses()) {
    const Eigen::VectorXd p = lens_parameters(camera);
    int checked = 0;
    for (double v = 0; v < 480; v += 37) {
      for (double u = 0; u < 640; u += 41) {
        Eigen::Vector3d ray;
        if (!camera.unproject({u, v}, &ray)) continue;
        const Eigen::Vector3d point = 0.7 * ray;
        Eigen::Vector2d px;
        Eigen::Matrix<double, 2, 3> by_point;
        LensJacobian by_lens;
        ASSERT_TRUE(project_with_lens(camera, point, &px, &by_point, &by_lens));
        EXPECT_NEAR((px - Eigen::Vector2d(u, v)).norm(), 0, 1e-8);
        ASSERT_EQ(by_lens.cols(), p.size());
        for (int i = 0; i < p.size(); ++i) {
          const double step = 1e-5 * std::max(1.0, std::abs(p(i)));
          Eigen::VectorXd more = p, less = p;
          more(i) += step;
          less(i) -= step;
          const auto a = make_lens(model, 640, 480, more), b = make_lens(model, 640, 480, less);
          Eigen::Vector2d px_a, px_b;
          ASSERT_TRUE(a && b && a->project(point, &px_a) && b->project(point, &px_b));
          const Eigen::Vector2d difference = (px_a - px_b) / (2 * step);
          EXPECT_LT((difference - by_lens.col(i)).norm(), 1e-5 * (1 + difference.norm()))
              << to_string(model) << " parameter " << i << " at " << u << ", " << v;
          ++checked;
        }
      }
    }
    EXPECT_GT(checked, 400);
  }
}

TEST(Lens, FreedomHoldsAndTies) {
  LensFreedom freedom;
  EXPECT_EQ(lens_freedom_map(LensModel::radtan5, freedom).cols(), 9);
  freedom.square_pixels = true;
  freedom.tangential = false;
  const Eigen::MatrixXd map = lens_freedom_map(LensModel::radtan5, freedom);
  ASSERT_EQ(map.cols(), 6);
  EXPECT_EQ(map(0, 0), 1);
  EXPECT_EQ(map(1, 0), 1);
  EXPECT_EQ(map.row(6).norm(), 0);
  EXPECT_EQ(map.row(7).norm(), 0);
  EXPECT_EQ(lens_freedom_map(LensModel::kannala_brandt, freedom).cols(), 7);
}

TEST(Conversion, ToItsOwnModelIsExact) {
  for (const auto& [model, camera] : lenses()) {
    const auto out = convert_lens(camera, model);
    ASSERT_TRUE(out) << to_string(model);
    EXPECT_LT(out->max_px, 1e-6) << to_string(model);
    EXPECT_GT(out->covered, 0.9);
  }
}

// What is stated is what is there: measured again, pixel by pixel.
TEST(Conversion, StatesItsResidual) {
  int converted = 0;
  for (const auto& [from, camera] : lenses()) {
    for (const auto& [to, other] : lenses()) {
      const auto out = convert_lens(camera, to);
      if (!out) continue;
      ++converted;
      double sum = 0, largest = 0;
      int n = 0;
      for (int v = 0; v < 480; v += 8) {
        for (int u = 0; u < 640; u += 8) {
          Eigen::Vector3d ray;
          Eigen::Vector2d px;
          // Towards the image plane nothing but a fisheye is asked to follow.
          if (!camera.unproject({u, v}, &ray) || (to != LensModel::kannala_brandt && ray.head<2>().norm() > 9.5))
            continue;
          if (!out->camera.project(ray, &px)) continue;
          const double distance = (px - Eigen::Vector2d(u, v)).norm();
          sum += distance * distance;
          largest = std::max(largest, distance);
          ++n;
        }
      }
      EXPECT_NEAR(std::sqrt(sum / n), out->rms_px, 0.15 * out->rms_px + 1e-6)
          << to_string(from) << " to " << to_string(to);
      EXPECT_LT(largest, 1.4 * out->max_px + 0.02) << to_string(from) << " to " << to_string(to);
    }
  }
  EXPECT_GT(converted, 28);
}

TEST(Conversion, KannalaBrandtHoldsEveryLens) {
  for (const auto& [model, camera] : lenses()) {
    const auto out = convert_lens(camera, LensModel::kannala_brandt);
    ASSERT_TRUE(out);
    EXPECT_LT(out->rms_px,
              model == LensModel::radtan4 || model == LensModel::radtan5 || model == LensModel::radtan8 ? 0.6 : 0.1)
        << to_string(model);
  }
}

TEST(Comparison, ForgivesARotationOnly) {
  const CameraModel a(CameraModelKind::pinhole, 640, 480, {500, 500}, {320, 240});
  const CameraModel turned(CameraModelKind::pinhole, 640, 480, {500, 500}, {322, 240});
  const CameraModel longer(CameraModelKind::pinhole, 640, 480, {510, 510}, {320, 240});
  const LensDifference small = compare_lenses(a, turned, {0, 0}, {639, 479});
  EXPECT_NEAR(small.rotation.norm(), 2.0 / 500, 0.001);  // a shifted centre is nearly a turned camera
  EXPECT_LT(small.rms_px, 1);
  EXPECT_GT(small.rms_px, 0.05);
  EXPECT_NEAR(compare_lenses(a, longer, {0, 0}, {639, 479}).max_px, 10.0 / 500 * std::hypot(320, 240), 0.2);
  EXPECT_LT(compare_lenses(a, a, {0, 0}, {639, 479}).max_px, 1e-9);
}

}  // namespace
}  // namespace parallax

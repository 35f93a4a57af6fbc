#include "core/terms/silhouette.h"

#include "core/blocks.h"
#include "core/parallel.h"
#include "spba/silhouette.h"

namespace spba {
namespace {

// Who is nearest to whom in one frame, or near enough to have no residual.
struct Matches {
  std::vector<Vector2> pixel_of_point;  // of the points in use
  std::vector<int> point_of_pixel;
  // By point: what pulls at it, farther away than the tolerance. Its own pixel comes first, as -1; the others
  // are those whose nearest point it is.
  PointLists<int> pulls;
};

class SilhouetteVisit : public Visit {
 public:
  SilhouetteVisit(const Views& views, const Footage& footage, const Visibility& visibility,
                  const SilhouetteOptions& options, const Loss& loss, int threads)
      : footage_(footage),
        visibility_(visibility),
        options_(options),
        loss_(loss),
        matches_(options.frames.size()) {
    ParallelFor(static_cast<int>(matches_.size()), threads, [&](int l) { Match(views, l); });
  }

  void AddPoint(int j, PointSystem* system) const override {
    for (size_t l = 0; l < matches_.size(); ++l) {
      const SilhouetteShare& share = options_.frames[l];
      const Matches& matches = matches_[l];
      if (matches.pulls.empty()) continue;
      for (const int* k = matches.pulls.begin(j); k != matches.pulls.end(j); ++k) {
        const bool own = *k < 0;
        Add(static_cast<int>(l),
            own ? matches.pixel_of_point[static_cast<size_t>(j)] : share.pixels[static_cast<size_t>(*k)],
            own ? share.point_weight * visibility_.SilhouetteWeight(j) : share.pixel_weight, system);
      }
    }
  }

  const Matches& matches(int l) const { return matches_[static_cast<size_t>(l)]; }

 private:
  void Match(const Views& views, int l) {
    const SilhouetteShare& share = options_.frames[static_cast<size_t>(l)];
    const FrameFootage& frame = footage_.frames[static_cast<size_t>(l)];
    Matches& matches = matches_[static_cast<size_t>(l)];
    const int projected = share.pixels.empty() ? share.points : views.point_count();
    std::vector<Vector2> at(static_cast<size_t>(projected));
    for (int j = 0; j < projected; ++j) {
      Project(frame.camera, views.InCamera(l, j).data(), at[static_cast<size_t>(j)].data());
    }
    const double tolerance = options_.tolerance;
    std::vector<int> pulls, points;
    const auto match = [&](const Vector2& pixel, int k, int j) {
      if ((at[static_cast<size_t>(j)] - pixel).squaredNorm() <= tolerance * tolerance) return;
      pulls.push_back(k);
      points.push_back(j);
    };
    matches.pixel_of_point.reserve(static_cast<size_t>(share.points));
    for (int j = 0; j < share.points; ++j) {
      matches.pixel_of_point.push_back(frame.silhouette->Nearest(at[static_cast<size_t>(j)], tolerance));
      match(matches.pixel_of_point.back(), -1, j);
    }
    if (!share.pixels.empty()) {
      const PointGrid grid(at);
      matches.point_of_pixel.reserve(share.pixels.size());
      for (size_t k = 0; k < share.pixels.size(); ++k) {
        matches.point_of_pixel.push_back(grid.Nearest(share.pixels[k], tolerance));
        match(share.pixels[k], static_cast<int>(k), matches.point_of_pixel.back());
      }
    }
    matches.pulls = PointLists<int>(
        views.point_count(), pulls.size(), [&](size_t i) { return points[i]; },
        [&](size_t i) { return pulls[i]; });
  }

  void Add(int l, const Vector2& pixel, double side_weight, PointSystem* system) const {
    PointView& view = system->View(l);
    const SilhouetteError error{
        footage_.frames[static_cast<size_t>(l)].camera, {pixel.x(), pixel.y()}, options_.tolerance};
    const double weight = options_.weight * side_weight;
    if (!system->with_derivatives()) {
      double residual = kNotEvaluated;
      error(view.position.data(), &residual);
      system->costs()[kSilhouette] += Weighed<1>(loss_, weight, Eigen::Matrix<double, 1, 1>(residual)).cost;
      return;
    }
    using Jet = ceres::Jet<double, 3>;
    const Jet position[3] = {Jet(view.position[0], 0), Jet(view.position[1], 1), Jet(view.position[2], 2)};
    Jet output(kNotEvaluated);
    error(position, &output);
    const Eigen::Matrix<double, 1, 1> residual(output.a);
    const Weighed<1> weighed(loss_, weight, residual);
    system->costs()[kSilhouette] += weighed.cost;
    system->Add<1>(&view, weighed, residual, output.v.transpose());
  }

  const Footage& footage_;
  const Visibility& visibility_;
  const SilhouetteOptions& options_;
  const Loss& loss_;
  std::vector<Matches> matches_;
};

// A point and a pixel of one frame, one of which is the other's nearest now.
class SilhouetteBlock : public Block<1> {
 public:
  // `index` is a point's for kPointToPixel, else a pixel's.
  enum class Side { kPointToPixel, kPixelToPoint };
  SilhouetteBlock(const BlockState& state, const Term* term, const SilhouetteOptions& options, int frame,
                  double width, Side side, int index)
      : Block(state, {frame}, width, false),
        term_(term),
        options_(options),
        frame_(frame),
        side_(side),
        index_(index) {}

  bool Evaluate(double const* const*, double* residuals, double** jacobians) const override {
    if (!state_.usable()) return false;
    const Matches& matches = static_cast<const SilhouetteVisit*>(state_.visit(term_))->matches(frame_);
    const auto index = static_cast<size_t>(index_);
    const bool from_point = side_ == Side::kPointToPixel;
    const int point = from_point ? index_ : matches.point_of_pixel[index];
    const Vector2& pixel = from_point ? matches.pixel_of_point[index]
                                      : options_.frames[static_cast<size_t>(frame_)].pixels[index];
    const SilhouetteError error{state_.objective().footage().frames[static_cast<size_t>(frame_)].camera,
                                {pixel.x(), pixel.y()},
                                options_.tolerance};
    return EvaluateOneView(error, point, residuals, jacobians);
  }

 private:
  const Term* const term_;
  const SilhouetteOptions& options_;
  const int frame_;
  const Side side_;
  const int index_;
};

class SilhouetteTerm : public Term {
 public:
  explicit SilhouetteTerm(SilhouetteOptions options)
      : options_(std::move(options)),
        loss_{options_.cauchy_width > 0 ? Loss::Kind::kCauchy : Loss::Kind::kSquare, options_.cauchy_width} {
    // Eq. 5 squares without a half, and is a mean over frames.
    options_.weight *= 2.0 / static_cast<double>(options_.frames.size());
  }

  std::unique_ptr<const Visit> Begin(const Views& views, const Footage& footage, const Visibility& visibility,
                                     int threads) const override {
    return std::make_unique<SilhouetteVisit>(views, footage, visibility, options_, loss_, threads);
  }

  void AddBlocks(const Visibility& visibility, BlockProblem* problem) const override {
    const auto add = [&](int l, SilhouetteBlock::Side side, int count, double side_weight) {
      for (int i = 0; i < count; ++i) {
        const double own =
            side == SilhouetteBlock::Side::kPointToPixel ? visibility.SilhouetteWeight(i) : 1.0;
        problem->Add(std::make_unique<SilhouetteBlock>(problem->state(), this, options_, l, loss_.SoftWidth(),
                                                       side, i),
                     problem->Scaled(options_.weight * (side_weight * own), loss_));
      }
    };
    for (size_t l = 0; l < options_.frames.size(); ++l) {
      const SilhouetteShare& share = options_.frames[l];
      const int frame = static_cast<int>(l);
      add(frame, SilhouetteBlock::Side::kPointToPixel, share.points, share.point_weight);
      add(frame, SilhouetteBlock::Side::kPixelToPoint, static_cast<int>(share.pixels.size()),
          share.pixel_weight);
    }
  }

 private:
  SilhouetteOptions options_;
  Loss loss_;
};

}  // namespace

std::unique_ptr<const Term> MakeSilhouetteTerm(SilhouetteOptions options) {
  return std::make_unique<SilhouetteTerm>(std::move(options));
}

}  // namespace spba

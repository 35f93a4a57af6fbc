// Intrinsics of a perspective camera, as all headers of this library have them.
#ifndef SPBA_PINHOLE_H_
#define SPBA_PINHOLE_H_

namespace spba {
inline namespace v0 {

// In pixels; the centre of the top-left pixel is (0.5, 0.5).
struct Pinhole {
  double fx, fy, cx, cy;
};

}  // namespace v0
}  // namespace spba

#endif  // SPBA_PINHOLE_H_

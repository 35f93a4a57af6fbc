// Where Ceres's log lines go.
#pragma once

namespace spba {
namespace bridge {

// Sends them to Rust instead of standard error and files; a host that set glog up keeps its own destinations.
void route_logs();

}  // namespace bridge
}  // namespace spba

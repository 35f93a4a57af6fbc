#include "bridge/logs.h"

#include <glog/logging.h>

#include "spba-ceres/src/bridge/ceres.rs.h"

namespace spba {
namespace bridge {
namespace {

class RustLogSink : public google::LogSink {
 public:
  void send(google::LogSeverity severity, const char*, const char*, int, const google::LogMessageTime&,
            const char* message, size_t length) override {
    log_message(severity, rust::Str(message, length));
  }
};

}  // namespace

void route_logs() {
  static const bool routed = [] {
    if (google::IsGoogleLoggingInitialized()) return false;
    google::InitGoogleLogging("spba-ceres");
    for (int severity = google::GLOG_INFO; severity < google::NUM_SEVERITIES; ++severity) {
      google::SetLogDestination(severity, "");
    }
    FLAGS_stderrthreshold = google::NUM_SEVERITIES;
    google::AddLogSink(new RustLogSink);
    return true;
  }();
  (void)routed;
}

}  // namespace bridge
}  // namespace spba

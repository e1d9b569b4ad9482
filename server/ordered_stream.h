#pragma once

#include <absl/base/thread_annotations.h>
#include <absl/status/status.h>
#include <absl/synchronization/mutex.h>
#include <grpcpp/support/server_callback.h>

#include <optional>

#include "server/grpc_status.h"

namespace adhesim {

// A bidirectional stream that keeps gRPC's rules whoever calls: one read and one write under way,
// one Finish(), never beside a write, and always one (a stream that is cancelled and not finished
// would make the server's shutdown wait for ever). Deletes itself at the end.
//
// gRPC never runs a reaction inside StartRead/StartWrite/Finish, so these are called with the mutex
// held.
template <typename Request, typename Response>
class OrderedStream : public grpc::ServerBidiReactor<Request, Response> {
 public:
  void OnReadDone(bool ok) final {
    // Not ok: the client has said all it wants to, or is gone.
    const absl::Status status = ok ? Receive(request_) : absl::OkStatus();
    if (!ok || !status.ok()) {
      Leave();
      Close(status);
      return;
    }
    {
      absl::MutexLock lock(&mutex_);
      if (!closing_) {
        this->StartRead(&request_);
        return;
      }
    }
    Leave();
  }

  void OnWriteDone(bool ok) final {
    absl::MutexLock lock(&mutex_);
    writing_ = false;
    if (!ok) closing_ = true;
    Continue();
  }

  void OnCancel() final { Close(absl::CancelledError("the client is gone")); }

  void OnDone() final {
    Leave();
    delete this;
  }

 protected:
  // Reads the first request. To be called once, by the creator.
  void Start() {
    absl::MutexLock lock(&mutex_);
    this->StartRead(&request_);
  }

  // A request has come in. An error ends the stream.
  virtual absl::Status Receive(const Request& request) = 0;
  // No more requests come. May be called several times.
  virtual void Leave() = 0;
  // Puts the next message into `response`; false when there is none.
  virtual bool Next(Response* response) = 0;
  // Why the server's side has ended; nothing while it goes on.
  virtual std::optional<absl::Status> Ended() const = 0;

  // Next() or Ended() may have something. Any thread.
  void Wake() {
    if (const std::optional<absl::Status> why = Ended()) {
      Close(*why);
    } else {
      absl::MutexLock lock(&mutex_);
      Continue();
    }
  }

  void Close(const absl::Status& status) {
    absl::MutexLock lock(&mutex_);
    if (!closing_) status_ = ToGrpcStatus(status);
    closing_ = true;
    Continue();
  }

 private:
  // Starts a write when none is under way, or ends the stream when it is closing.
  void Continue() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    if (writing_ || finished_) return;
    if (closing_) {
      finished_ = true;
      this->Finish(status_);
    } else if (Next(&response_)) {
      writing_ = true;
      this->StartWrite(&response_);
    }
  }

  absl::Mutex mutex_;
  Request request_;
  Response response_ ABSL_GUARDED_BY(mutex_);
  bool writing_ ABSL_GUARDED_BY(mutex_) = false;
  bool closing_ ABSL_GUARDED_BY(mutex_) = false;
  bool finished_ ABSL_GUARDED_BY(mutex_) = false;
  grpc::Status status_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace adhesim

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <revisit/core/result.hpp>

#include "view/results_view.hpp"

namespace revisit::cli {

struct ServerOptions {
  std::string host = "127.0.0.1";
  int port = 0;       ///< 0: any that is free
  std::string token;  ///< asked of everybody where it is not empty
};

/// Serves the page and what it shows, over HTTP: reads only, nothing but the files that a view is made of, and only of
/// the folders it was given. Works in threads of its own until it is destroyed.
class ViewServer {
 public:
  /// The views are a/ and b/ on the page.
  static Result<std::unique_ptr<ViewServer>> start(std::vector<std::shared_ptr<ResultsView>> views,
                                                   const ServerOptions& options);
  ~ViewServer();
  const std::string& address() const { return address_; }  ///< with the token

 private:
  class Implementation;
  ViewServer() = default;
  std::unique_ptr<Implementation> implementation_;
  std::string address_;
};

}  // namespace revisit::cli

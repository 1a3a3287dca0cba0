// SPDX-License-Identifier: Apache-2.0
#include <revisit/vision/image_features.hpp>

#include <algorithm>
#include <cstring>
#include <numeric>

#include <opencv2/features2d.hpp>

namespace revisit {

std::vector<BinaryFeature> find_features(const Image& image, const FeatureOptions& options) {
  if (image.grey.empty()) return {};
  // OpenCV's header of foreign memory wants it writable, and does not write.
  const cv::Mat pixels(image.height, image.width, CV_8UC1, const_cast<std::uint8_t*>(image.grey.data()));
  const auto orb =
      cv::ORB::create(options.most, 1.2f, options.levels, 31, 0, 2, cv::ORB::HARRIS_SCORE, 31, options.threshold);
  std::vector<cv::KeyPoint> keypoints;
  cv::Mat descriptors;
  orb->detectAndCompute(pixels, cv::noArray(), keypoints, descriptors);
  std::vector<BinaryFeature> features(keypoints.size());
  for (std::size_t i = 0; i < keypoints.size(); ++i) {
    features[i].column = keypoints[i].pt.x;
    features[i].row = keypoints[i].pt.y;
    std::memcpy(features[i].bits.data(), descriptors.ptr(static_cast<int>(i)), sizeof(features[i].bits));
  }
  return features;
}

}  // namespace revisit

#include "faultline/signal/sample.h"

namespace faultline {

void Recording::append(const Sample& sample) {
  time.push_back(sample.time);
  sequence.push_back(sample.sequence);
  values.insert(values.end(), sample.values.begin(), sample.values.end());
}

Sample Recording::sample(std::size_t index) const {
  Sample sample;
  sample.time = time[index];
  sample.sequence = sequence[index];
  sample.values.assign(row(index), row(index) + columns());
  return sample;
}

}  // namespace faultline

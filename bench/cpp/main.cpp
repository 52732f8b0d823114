// stretchmap_bench: every stage of the core on generated solid tori of given sizes.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <sstream>
#include <stdexcept>

#include "stages.hpp"
#include "stretchmap/base/errors.hpp"
#include "stretchmap/base/threads.hpp"

namespace stretchmap::bench {

bool wanted(const Settings& settings, const std::string& group) {
  return settings.only.empty() ||
         std::find(settings.only.begin(), settings.only.end(), group) != settings.only.end();
}

std::string row_name(const std::string& stage, const SolidTorus& solid, const Settings& settings) {
  return stage + "/" + std::to_string(solid.tets.rows()) +
         "/threads:" + std::to_string(settings.threads);
}

namespace {

constexpr const char* kUsage =
    "usage: stretchmap_bench [--sizes N,N,...] [--threads N,N,...] [--only GROUP,...]\n"
    "                        [--vsem-steps N] [--newton-steps N] [--c C] [--json FILE]\n"
    "                        [--context KEY=VALUE]...\n"
    "Groups: mesh, surface, linalg, volume, newton. Sizes are tets of a generated solid torus.\n";

struct Arguments {
  std::vector<long> sizes{10000, 100000};
  std::vector<long> threads{1, 2};
  std::string json;
  Context context;
  Settings settings;
};

std::vector<std::string> split(const std::string& text) {
  std::vector<std::string> parts;
  std::istringstream in(text);
  for (std::string part; std::getline(in, part, ',');) parts.push_back(part);
  if (parts.empty()) throw std::invalid_argument("an empty list");
  return parts;
}

long integer(const std::string& text, long least, long most) {
  std::size_t used = 0;
  long value = 0;
  try {
    value = std::stol(text, &used);
  } catch (const std::exception&) {
    used = 0;
  }
  if (used == 0 || used != text.size() || value < least || value > most)
    throw std::invalid_argument(text + " is not a whole number between " + std::to_string(least) +
                                " and " + std::to_string(most));
  return value;
}

std::vector<long> integers(const std::string& text, long least, long most) {
  std::vector<long> values;
  for (const std::string& part : split(text)) values.push_back(integer(part, least, most));
  return values;
}

Arguments parse(int argc, char** argv) {
  Arguments a;
  for (int i = 1; i < argc; ++i) {
    const std::string key = argv[i];
    if (i + 1 == argc) throw std::invalid_argument(key + " is unknown or lacks its value");
    const std::string value = argv[++i];
    if (key == "--sizes") {
      a.sizes = integers(value, 300, 100000000);
    } else if (key == "--threads") {
      a.threads = integers(value, 1, 1024);
    } else if (key == "--only") {
      a.settings.only = split(value);
    } else if (key == "--vsem-steps") {
      a.settings.vsem_steps = static_cast<int>(integer(value, 0, 10000));
    } else if (key == "--newton-steps") {
      a.settings.newton_steps = static_cast<int>(integer(value, 0, 10000));
    } else if (key == "--c") {
      a.settings.c = std::stod(value);
    } else if (key == "--json") {
      a.json = value;
    } else if (key == "--context") {
      const std::size_t equals = value.find('=');
      if (equals == std::string::npos) throw std::invalid_argument("--context wants KEY=VALUE");
      a.context.emplace_back(value.substr(0, equals), value.substr(equals + 1));
    } else {
      throw std::invalid_argument(key + " is unknown");
    }
  }
  return a;
}

void run(Arguments& a) {
  std::vector<Record> records;
  const auto report = [&](Record record) {
    record.threads = a.settings.threads;
    print(record);
    records.push_back(std::move(record));
  };
  print_header();
  for (const long threads : a.threads) {
    a.settings.threads = static_cast<int>(threads);
    set_thread_count(a.settings.threads);
    Record probe = copy_bandwidth(a.settings.threads);
    probe.name += "/threads:" + std::to_string(threads);
    a.settings.bandwidth = probe.counters.front().second;
    report(probe);
    for (const long size : a.sizes) {
      SolidTorus solid;
      Record generated = measure(
          "sample", [&] { solid = solid_torus(static_cast<Index>(size)); }, 0.0, 1);
      generated.name = row_name("sample", solid, a.settings);
      generated.counters = {{"tets", solid.tets.rows()}, {"vertices", solid.points.rows()}};
      report(generated);
      if (wanted(a.settings, "mesh") || wanted(a.settings, "surface"))
        surface_stages(solid, a.settings, report);
      if (wanted(a.settings, "linalg")) linalg_stages(solid, a.settings, report);
      volume_stages(solid, a.settings, report);
    }
  }
  if (!a.json.empty()) write_json(a.json, a.context, records);
}

}  // namespace
}  // namespace stretchmap::bench

int main(int argc, char** argv) {
  using namespace stretchmap::bench;
  Arguments arguments;
  try {
    arguments = parse(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n%s", error.what(), kUsage);
    return 2;
  }
  try {
    run(arguments);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}

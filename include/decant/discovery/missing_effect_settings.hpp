// SPDX-License-Identifier: MIT
#pragma once

/// Settings of the workflow that finds what a model lacks.

#include <decant/core/target.hpp>
#include <decant/discovery/effect_dictionary.hpp>
#include <decant/discovery/effect_evidence.hpp>
#include <decant/discovery/effect_judgement.hpp>

namespace decant::inline DECANT_TARGET {

/// Settings of MissingEffectSearch.
struct MissingEffectSettings {
  DictionarySettings dictionary{};
  DictionarySettings next_dictionary{4, 16, {0.5}, 0};  ///< after an effect was added, and something is still missing
  RecordedEvidenceSettings evidence{};
  JudgementSettings judgement{};
  int refined = 3;                 ///< so many of the best are looked at more closely, >= 1; and up to as
                                   ///< many more that chance does not tell from them
  int refinement_rounds = 3;       ///< steps for each, >= 1
  int last_refinement_rounds = 8;  ///< steps for the best of them in all, as long as each gains
  int repeats = 8;                 ///< of the best one, to see how far estimates scatter, >= 3
  int refinement_seeds = 2;        ///< runs at each point, >= 1
  double least_share = 0.7;        ///< of what is reducible an effect has to explain in the end, 0 .. 1; several
                                   ///< together may leave so many times less. Where no more is left than chance
                                   ///< leaves, it only has to take away more than chance does
  double most_left = 5;            ///< over what chance leaves at most, > 0: what leaves more of a gap does not explain
                                   ///< it, whatever its share. Effects of a simulation are not those of reality to
                                   ///< the last cell; where a model is as exact as its sensors ask for 1 to 2
  double most_grown = 0.02;        ///< >= 0: what makes the gap grow by more than this share of it at moments at which
                                   ///< it grows does not explain it: it stands in for something else
  double enough_share = 0.85;      ///< nothing else is looked for beside effects that explain so much, 0 .. 1:
                                   ///< what is left may be how the model has them
  double promising_factor = 0.8;   ///< on n / (n + 1), >= 0: unless n effects explain so much, no further one is
                                   ///< looked for
  double sure = 0.9;               ///< how probable an effect has to be among those that were refined to be the
                                   ///< answer, 0 .. 1; else it is one of those that are so together
  int most_effects = 3;            ///< that are added one after another, >= 1
  int beam = 2;                   ///< sets that further effects are looked for beside, if they come near the best, >= 1
  double reference_factor = 1.1;  ///< on what references do, >= 1: beyond it something is missing
  double most_unlike = 0.5;       ///< references that look more unlike a recording teach nothing about how its
                                  ///< features are off, >= 0; see RecordedEvidence::unlikeness
  int least_references = 2;       ///< that have to look like a recording for them to teach that, >= 2
  double threshold = 4;           ///< of find_disagreements
};

}  // namespace decant::inline DECANT_TARGET

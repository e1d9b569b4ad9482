#pragma once

#include <vector>

#include "core/engine/engine.h"

namespace adhesim {

// Starts that no scene can express: positions [#particles] of a scene's bodies, spoilt. Seeded:
// the same every time. Lengths are those of the box around all particles.
using Spoil = void (*)(const Model& model, std::vector<Vec3>* position_m);

void Flatten(const Model& model, std::vector<Vec3>* position_m);        // into the plane z = middle
void Collapse(const Model& model, std::vector<Vec3>* position_m);       // into one point
void TurnInsideOut(const Model& model, std::vector<Vec3>* position_m);  // mirrored in z
void Strew(const Model& model,
           std::vector<Vec3>* position_m);  // each by up to an eighth of the box
void Scramble(const Model& model, std::vector<Vec3>* position_m);        // anywhere in the box
void TwistFourTurns(const Model& model, std::vector<Vec3>* position_m);  // about x, along x
void StretchTenfold(const Model& model, std::vector<Vec3>* position_m);  // along x

// Puts an engine at such a start.
void StartFrom(Spoil spoil, Engine* engine);

// What tools are told where no trajectory can tell it.
using Drive = void (*)(const Engine& engine, std::vector<ToolInput>* inputs);

// The trajectory, and every other step 5 mm beside it, at whatever rate.
void Jitter(const Engine& engine, std::vector<ToolInput>* inputs);
// The trajectory as a bad line brings it: of every pose 30 % are lost, and those that come are up
// to 40 ms late, so that some overtake others.
void LosePoses(const Engine& engine, std::vector<ToolInput>* inputs);

}  // namespace adhesim

// Rotation by a quaternion xyzw of any length but 0, v + w t + u×t, t = 2 u×v / |q|², and the matrix of it
// [Kuipers, Quaternions and Rotation Sequences, 1999, sec. 5.15].
#pragma once

namespace engine {

// Turn a vector of a body's frame into the world's.
void rotate(const double q[4], const double vector[3], double rotated[3]);

// Turn a vector of the world into a body's frame.
void rotate_back(const double q[4], const double vector[3], double rotated[3]);

// Fill the matrix that turns a body's frame into the world's.
void fill_rotation(const double q[4], double (&matrix)[3][3]);

}  // namespace engine

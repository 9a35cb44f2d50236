//! Elbowroom: plans that leave room.

; Ward a receives goods until 100, ward b from 80 to 170.

(define (problem morning)
  (:domain ward)

  (:objects
    robo1 robo2 - robot
    dock pharmacy ward-a ward-b - place
    medicine bandages blood - item)

  (:init
    (at robo1 dock) (idle robo1) (empty robo1) (= (battery robo1) 140)
    (at robo2 dock) (idle robo2) (empty robo2) (= (battery robo2) 100)
    (lies medicine pharmacy) (lies bandages pharmacy) (lies blood pharmacy)
    (has-charger dock)

    (visiting-hours ward-a)
    (at 100 (not (visiting-hours ward-a)))
    (at 80 (visiting-hours ward-b))
    (at 170 (not (visiting-hours ward-b)))

    (= (way dock pharmacy) 10) (= (way pharmacy dock) 10)
    (= (way pharmacy ward-a) 25) (= (way ward-a pharmacy) 25)
    (= (way pharmacy ward-b) 30) (= (way ward-b pharmacy) 30)
    (= (way ward-a ward-b) 15) (= (way ward-b ward-a) 15)
    (= (way dock ward-a) 30) (= (way ward-a dock) 30)
    (= (way dock ward-b) 35) (= (way ward-b dock) 35))

  (:goal (and (lies medicine ward-a) (lies bandages ward-b) (lies blood ward-b)))
  (:metric minimize (total-time)))
